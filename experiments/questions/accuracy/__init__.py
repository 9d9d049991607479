"""How accurate are the answers, and what does accuracy cost?"""
