// SPDX-License-Identifier: Apache-2.0
// One association in which files are received, with DCMTK. Only in plumb-dicomd's children.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "drivers/dicom/send_content.hpp"

namespace plumb {

/// A file that was received, bit by bit as it was sent.
struct ReceivedObject {
  std::filesystem::path file;
  std::string calling_ae_title, class_uid, instance_uid;
};

struct ReceiveRules {
  std::string ae_title;                              ///< By which we are called.
  std::function<bool(const std::string&)> is_known;  ///< Of the caller's title, at its address.
  DicomTlsFiles tls;                                 ///< Empty: in the clear.
  /// A new name for a file; nothing where there is no more room.
  std::function<std::optional<std::filesystem::path>()> new_file;
  /// Keeps a complete file, durably, before its sender is told so; false if that failed.
  std::function<bool(const ReceivedObject&)> keep;
  std::function<void(const std::string&)> audit;  ///< Of everything that is refused or kept.
};

/// Serves a connection to its end: C-ECHO, and C-STORE of RT Structure Sets, RT Plans and CT images
/// in explicit or implicit little endian. Before the first byte is read the process gives up its
/// rights for good (Allowed::kStore).
/// @throws DataError if the files of TLS cannot be used.
void ReceiveAssociation(int connection, const ReceiveRules& rules);

}  // namespace plumb
