"""Maximum-likelihood estimation for any model and data."""
