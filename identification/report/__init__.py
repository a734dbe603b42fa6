"""A diagnosis as a person and a machine read it: page, pictures, sentences, `report.json`."""
