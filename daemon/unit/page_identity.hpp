// SPDX-License-Identifier: Apache-2.0
// The secrets by which browsers recognise the appliance and the appliance recognises browsers:
// certificate and key of TLS and of the authority that signs it, key of the device cookies. Created
// at the first start and kept in the state folder.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "daemon/config/config.hpp"
#include "web/http/server_options.hpp"

namespace plumb {

/// Facts about the page for journal and status.
struct PageNotes {
  std::string url;
  std::string certificate;  ///< Its SHA-256 fingerprint; empty without TLS.
  std::vector<Message> warnings;
  bool are_guesses_running = false;  ///< Shown by the light: somebody is guessing passwords.
};

/// Reads a file with a secret; if there is none, `make` provides its contents. Only the owner can
/// read it, and an incomplete file is never visible.
/// @throws DataError if the path is not such a file or the file is longer than 64 kB; IoError if it
///         cannot be written.
[[nodiscard]] std::string ReadOrMakeSecret(const std::filesystem::path& file,
                                           const std::function<std::string()>& make);

/// Writes such a file in one step, with the owner of its folder.
/// @throws IoError
void KeepSecret(const std::filesystem::path& file, const std::string& contents);

/// @throws DataError for keys of [web] that do not fit together, or a certificate or key that
///         cannot be used.
void CheckPageIdentity(const WebConfig& web);

/// What a program shows that asks without an account, such as the token of [web]
/// metrics_token_file.
/// @param file  Empty: there is none, and an empty text is returned.
/// @throws DataError if the file is missing, or the token too short to be a secret or of other than
///         letters, digits, '-' and '_'; IoError if the file cannot be read.
[[nodiscard]] std::string AccessToken(const std::filesystem::path& file);

/// Stores the identity of the page for the next start, with the owner of the folder.
/// @throws IoError
void KeepPageIdentity(const std::filesystem::path& state, const web::TlsIdentity& identity);

/// The socket that the page is served on.
struct PageSocket {
  int fd = -1;
  Message fault;    ///< Why it is not where the configuration says; empty: it is there.
  Message warning;  ///< Why the page cannot be reached yet; empty: it can be.
};
/// Where `web.listen` says; where that cannot be opened at `otherwise`, so that the page can say
/// what is wrong; `web.listen` is changed with it.
/// @throws IoError where neither can be opened
[[nodiscard]] PageSocket OpenPageSocket(WebConfig& web, const std::string& otherwise);

/// Fills in `tls`, `keep_certificate` (not for a certificate that the configuration names) and
/// `device_key` of the options from the configuration, and returns the facts about the page. A
/// secret of the appliance's own that cannot be stored is created for this run only, with a
/// warning.
/// @throws DataError for the certificate or key that the configuration names.
[[nodiscard]] PageNotes IdentifyPage(const Config& config, web::HttpServerOptions& options);

}  // namespace plumb
