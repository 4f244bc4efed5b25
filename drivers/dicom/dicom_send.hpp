// SPDX-License-Identifier: Apache-2.0
// Sends DICOM files, by plumb-dicom-sender in a process of its own.
#pragma once

#include <cstddef>
#include <functional>

#include "drivers/dicom/send_content.hpp"

namespace plumb {

/// Sends all files in one association (C-STORE), in their order.
/// @param on_sent  Called with the number of files that the other side has stored.
/// @throws DataError if a file cannot be sent, or the other side refuses, with its reason; IoError
/// if
///         this installation has no such program. Files that were sent before stay sent.
void SendDicom(const DicomSendRequest& request, const std::function<void(std::size_t)>& on_sent);

}  // namespace plumb
