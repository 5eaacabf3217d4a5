"""Decision trees: trained by scikit-learn, then carried on as plain data."""
