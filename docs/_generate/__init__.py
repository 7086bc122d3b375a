"""Pages of the documentation that the package writes about itself, at build time."""
