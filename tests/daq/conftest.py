"""Settings of the tests of the daemon."""

from hypothesis import settings

settings.register_profile("any machine", deadline=None)  # an example may take long on a busy machine
settings.load_profile("any machine")
