"""Whether a trajectory is physically true and does its task, judged from its file alone."""

from multimodal_to.auditing.audit import Audit, audit
from multimodal_to.auditing.findings import Finding
from multimodal_to.auditing.properties import PROPERTIES, check_allowances
from multimodal_to.auditing.property import Judged, Of, Property
from multimodal_to.auditing.self_collision import Clearance, link_clearances

__all__ = [
    "PROPERTIES",
    "Audit",
    "Clearance",
    "Finding",
    "Judged",
    "Of",
    "Property",
    "audit",
    "check_allowances",
    "link_clearances",
]
