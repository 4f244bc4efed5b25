// SPDX-License-Identifier: Apache-2.0
// Certificates of other servers, as people make them with openssl.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>

#include <fmt/format.h>

namespace plumb::testing {

struct SelfSignedOptions {
  int days = 2;                          ///< Of its validity, from now.
  std::string key_options = "rsa:2048";  ///< After -newkey.
  std::string options = {};              ///< Others of `openssl req`.
};

/// Writes a key and the certificate for this name that it has signed itself.
/// @throws std::runtime_error if openssl refuses.
inline void MakeSelfSigned(const std::filesystem::path& certificate,
                           const std::filesystem::path& key, const std::string& name,
                           const SelfSignedOptions& how = {}) {
  const std::string line = fmt::format(
      "openssl req -x509 -newkey {} -nodes -days {} -subj '/CN={}' -keyout '{}' -out '{}' {} "
      "2> /dev/null",
      how.key_options, how.days, name, key.string(), certificate.string(), how.options);
  if (std::system(line.c_str()) != 0) throw std::runtime_error("failed: " + line);
}

}  // namespace plumb::testing
