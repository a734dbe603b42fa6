"""How fast the kit is, measured beside its peers; run by ``windwrench speed``."""
