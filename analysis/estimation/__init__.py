"""Maximum-likelihood estimation for any model and data; `aircraft_models` holds the models of aircraft."""
