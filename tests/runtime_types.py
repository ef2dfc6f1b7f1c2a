"""The checker that the import hook in `conftest.py` wraps around every annotated function of `hgs_core`."""

from beartype import BeartypeConf, beartype

# The numeric tower: an int is fine where a float is asked for, as it is for static checkers.
checked = beartype(conf=BeartypeConf(is_pep484_tower=True))
