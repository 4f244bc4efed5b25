// SPDX-License-Identifier: Apache-2.0
// A display in the room may read what the status names, and nothing else.
#pragma once

#include "web/http/router.hpp"
#include "web/service/services.hpp"

namespace plumb::web {

/// Limits displays to the records that the status names: the patient of the open session with the
/// approved reference, and the last result with its patient, its reference and the scene of that
/// reference. Any other record is answered as one that does not exist. Call it after all routes of
/// `Permission::kRoom` have been added: those whose path names a record and that are not known here
/// are refused. The services must outlive the router.
void LimitDisplays(Router& router, const Services& services);

/// Whether the page without script may show this scan to a display: the last result, and a scan
/// that failed, each in its own session only.
[[nodiscard]] bool IsForDisplay(const Scan& scan, const Status& status);

}  // namespace plumb::web
