"""What the paper does not have: roots in order of priority, and routines."""
