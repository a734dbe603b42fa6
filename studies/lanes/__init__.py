"""Do environments in lanes have the statistics of those on MuJoCo?"""
