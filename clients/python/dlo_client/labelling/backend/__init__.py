"""``dlo label-studio``: a machine learning backend for Label Studio, which asks it for predictions
of its tasks."""
