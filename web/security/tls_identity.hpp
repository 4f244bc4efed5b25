// Certificate and key of the appliance for TLS.
#pragma once

#include <string>
#include <vector>

namespace plumb::web {

struct TlsIdentity {
  std::string certificate_pem;  ///< The certificate, and any that lead from it to an authority.
  std::string key_pem;
  std::string fingerprint;  ///< SHA-256 of the certificate: "AB:CD:...", as browsers show it.
};

inline constexpr unsigned kMaxChain = 8;  ///< Certificates of one identity at most.

/// The supported TLS versions, with forward secrecy only, as a priority string of GnuTLS.
inline constexpr const char* kTlsPriorities =
    "SECURE128:-VERS-ALL:+VERS-TLS1.3:+VERS-TLS1.2:-RSA:%SERVER_PRECEDENCE";

/// An elliptic key and a self-signed certificate for localhost, this machine's name and `names`. It
/// is valid from 2020 to 2106: at its first start a machine may not know the date, and it is
/// trusted by its fingerprint alone.
/// @throws IoError if the library refuses.
[[nodiscard]] TlsIdentity MakeTlsIdentity(const std::vector<std::string>& names);

/// Checks PEM texts from files: a certificate, a key, and that they belong together. One text may
/// hold both.
/// @param name  Name of the source for messages.
/// @throws DataError
[[nodiscard]] TlsIdentity CheckedTlsIdentity(const std::string& certificate_pem,
                                             const std::string& key_pem, const std::string& name);

}  // namespace plumb::web
