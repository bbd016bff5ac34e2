"""What accuracy costs at the answer: a study run with other models in turn, all else fixed."""
