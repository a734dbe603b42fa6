"""Where the numbers of README and pages come from: pages that are made of kept results are made
again and compared, figures in prose are compared with the results they quote.
"""
