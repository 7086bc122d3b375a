"""Study: a ship identified from half of its logged zig-zags predicts the other half."""
