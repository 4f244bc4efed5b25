// Certificate and key by which browsers know the appliance over TLS.
#pragma once

#include <string>
#include <vector>

namespace plumb::web {

struct TlsIdentity {
  std::string certificate_pem;  ///< The certificate, and any that lead from it to an authority.
  std::string key_pem;
  std::string fingerprint;  ///< SHA-256 of the certificate: "AB:CD:...", as browsers show it.
};

/// The versions of TLS that are spoken, and no exchange of keys without forward secrecy; a priority
/// string of GnuTLS.
inline constexpr const char* kTlsPriorities =
    "SECURE128:-VERS-ALL:+VERS-TLS1.3:+VERS-TLS1.2:-RSA:%SERVER_PRECEDENCE";

/// An elliptic key and a certificate that it signs itself, for localhost, this machine's name and
/// `names`. It is valid from 2020 to 2106: at its first start a machine may not know the
/// date, and it is trusted by its fingerprint alone.
/// @throws IoError if the library refuses.
[[nodiscard]] TlsIdentity MakeTlsIdentity(const std::vector<std::string>& names);

/// Checks PEM texts that came from files: a certificate, a key, and that they belong together. One
/// text may hold both.
/// @param name  Of where they came from, for messages.
/// @throws DataError
[[nodiscard]] TlsIdentity CheckedTlsIdentity(const std::string& certificate_pem,
                                             const std::string& key_pem, const std::string& name);

}  // namespace plumb::web
