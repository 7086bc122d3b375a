"""Study: two tankers by MMG and by Gertler-Hagen rows, on held-out zig-zags and turns."""
