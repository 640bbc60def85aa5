"""Whether a trajectory is physically true and does its task, judged from its file alone."""

from multimodal_to.auditing.audit import Audit, audit
from multimodal_to.auditing.findings import Finding
from multimodal_to.auditing.properties import PROPERTIES, check_allowances
from multimodal_to.auditing.property import Judged, Property

__all__ = ["PROPERTIES", "Audit", "Finding", "Judged", "Property", "audit", "check_allowances"]
