"""The doctor: what can be said of a task before the long solve, and what to change where it is hopeless.

Checks are functions from a `Task` to the symptoms that they find; `examination` holds their order.
"""

from multimodal_to.doctor.diagnosis import Diagnosis, Severity, Symptom
from multimodal_to.doctor.examination import doctor, refusal

__all__ = ["Diagnosis", "Severity", "Symptom", "doctor", "refusal"]
