"""Study: mean wind of real runs from their motion alone, set against the anemometer."""
