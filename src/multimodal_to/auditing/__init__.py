"""Whether a trajectory is physically true and does its task, judged from its file alone."""

from multimodal_to.auditing.audit import Audit, audit
from multimodal_to.auditing.findings import Finding

__all__ = ["Audit", "Finding", "audit"]
