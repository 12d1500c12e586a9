"""What is measured of integrators: the cases that all of them meet, their errors and costs, and what those say."""
