// By what browsers know the appliance, and the appliance them: certificate and key of TLS, key of
// the device cookies. Made at the first start, kept in the state folder.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "daemon/config/config.hpp"
#include "web/http/server_options.hpp"

namespace plumb {

/// What is told about the page in journal and status.
struct PageNotes {
  std::string url;
  std::string certificate;  ///< Its SHA-256 fingerprint; empty: no TLS.
  std::vector<std::string> warnings;
};

/// A file with a secret: `make` is asked for its contents if there is none. Others than the owner
/// cannot read it, and what is half written is not seen.
/// @throws DataError if what is there is no such file or longer than 64 kB; IoError if it cannot be
///         written.
[[nodiscard]] std::string ReadOrMakeSecret(const std::filesystem::path& file,
                                           const std::function<std::string()>& make);

/// @throws DataError for keys of [web] that do not fit together, or a certificate or key that
/// cannot
///         be used.
void CheckPageIdentity(const WebConfig& web);

/// Keeps what the page is served with from the next start on, for whom the folder belongs to.
/// @throws IoError
void KeepPageIdentity(const std::filesystem::path& state, const web::TlsIdentity& identity);

/// Fills in `tls`, `keep_certificate` (not for a certificate that the configuration names) and
/// `device_key` of the options by the configuration, and gives what there is to
/// tell. A secret of the appliance's own that cannot be kept is made for this run, with a warning.
/// @throws DataError for the certificate or key that the configuration names.
[[nodiscard]] PageNotes IdentifyPage(const Config& config, web::HttpServerOptions& options);

}  // namespace plumb
