"""Partners at the human's seat of a study: learned proxies, scripted players, recorded people."""
