// SPDX-License-Identifier: Apache-2.0
// Certificate and key of the appliance for TLS.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "algo/base/message.hpp"

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

/// The names that this machine has now: its host name, with and without ".local" (mDNS). Read anew
/// at each call, because a name can change while the service runs. Empty where it has none.
[[nodiscard]] std::vector<std::string> OwnNames();

/// This machine's addresses in its networks now, as numbers, without link-local ones.
[[nodiscard]] std::vector<std::string> OwnAddresses();

/// Subject of the certificates that this machine makes for itself.
inline constexpr std::string_view kOwnSubject = "Plumb scan appliance";

/// The validity of such a certificate: Safari refuses one of more than 825 days, and browsers one
/// of more than 398 days that an authority signed.
inline constexpr std::chrono::hours kOwnValidity{820 * 24}, kIssuedValidity{397 * 24};

/// An elliptic key and a self-signed certificate for localhost, this machine's names and addresses
/// (without link-local ones), and `names`. It is valid from a day before `now` for
/// kOwnValidity.
/// @throws IoError if the library refuses.
[[nodiscard]] TlsIdentity MakeTlsIdentity(
    const std::vector<std::string>& names,
    std::chrono::system_clock::time_point now = std::chrono::system_clock::now());

/// What the subject of a unit's own authority begins with; the rest tells units apart.
inline constexpr std::string_view kAuthoritySubject = "Plumb authority ";

/// An authority of this unit's own, certificate and key as one PEM text: people install the
/// certificate once, and the unit renews those of its page without another question. It signs no
/// authorities and, as to names, only for localhost, this machine's and `names`, so that a tablet
/// that trusts it trusts it for no other site; addresses change, and are not limited.
/// @throws IoError if the library refuses.
[[nodiscard]] std::string MakeAuthority(
    const std::vector<std::string>& names,
    std::chrono::system_clock::time_point now = std::chrono::system_clock::now());

/// Whether browsers that trust this authority accept what it issues now for these names, for as
/// long as that is valid.
/// @throws DataError if the text holds no authority.
[[nodiscard]] bool CanIssue(const std::string& authority, const std::vector<std::string>& names,
                            std::chrono::system_clock::time_point now);

/// As MakeTlsIdentity(), signed by the authority, whose certificate follows; for kIssuedValidity.
/// @throws DataError if the text holds no authority; IoError if the library refuses.
[[nodiscard]] TlsIdentity IssueTlsIdentity(const std::string& authority,
                                           const std::vector<std::string>& names,
                                           std::chrono::system_clock::time_point now);

struct AuthorityCertificate {
  std::string pem, fingerprint;
};
/// The certificate of the unit's own authority, if it has signed the first of this chain, which is
/// one of the unit's own.
[[nodiscard]] std::optional<AuthorityCertificate> OwnAuthorityOf(const std::string& chain_pem);

/// Checks PEM texts from files: a certificate, a key, and that they belong together. One text may
/// hold both.
/// @param what  The source, in messages.
/// @throws DataError
[[nodiscard]] TlsIdentity CheckedTlsIdentity(const std::string& certificate_pem,
                                             const std::string& key_pem, const Message& what);

}  // namespace plumb::web
