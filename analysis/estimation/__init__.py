"""Maximum-likelihood estimation: general, it knows models and data; the aircraft's own models are in `models`."""
