"""How good the wrench is that ``windwrench estimate`` finds in a log."""
