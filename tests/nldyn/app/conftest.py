from fakes import fakes_are_saved, fakes_know_their_normal_form  # noqa: F401
