// SPDX-License-Identifier: Apache-2.0
// Warnings about the page's certificate before browsers reject it.
#pragma once

#include <chrono>
#include <ctime>
#include <optional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "web/security/tls_identity.hpp"

namespace plumb::web {

/// Time before its end from which a certificate is warned about.
inline constexpr std::chrono::hours kWarnBeforeEnd{30 * 24};

/// For people, each with the subject of its certificate: a weak key (RSA of less than
/// 2048 bits), a kind of key that browsers do not accept, an expiry that has passed or comes within
/// kWarnBeforeEnd, a validity that has not begun. Looks at the whole chain. Empty if there is
/// nothing to report.
/// @param pem  The certificate and any that lead from it to an authority; other blocks are ignored.
/// @throws DataError if it contains no certificate that can be read.
[[nodiscard]] std::vector<Message> CertificateWarnings(const std::string& pem,
                                                       std::chrono::system_clock::time_point now);

/// Properties of a certificate for comparison and planning.
struct CertificateFacts {
  std::string subject;
  std::time_t valid_until = 0;  ///< Expiry of the certificate of its chain that expires first.
};
/// @throws DataError as CertificateWarnings().
[[nodiscard]] CertificateFacts FactsOfCertificate(const std::string& pem);

/// Whether this machine made the certificate for itself and must now replace it, because it expires
/// within twice kWarnBeforeEnd, begins in the future (the clock was wrong), is valid for longer
/// than its kind may be (as those of 0.2.0) or lacks one of `names`. A certificate that a person
/// set is never due.
/// @param now  Nothing: the clock cannot be trusted, so that dates do not count. A certificate that
///        a wrong clock makes is one that no browser accepts once the clock is right.
/// @throws DataError as CertificateWarnings().
[[nodiscard]] bool IsDueForRenewal(const std::string& pem,
                                   std::optional<std::chrono::system_clock::time_point> now,
                                   const std::vector<std::string>& names);

/// CheckedTlsIdentity() for an uploaded identity: also refuses what browsers would reject now: keys
/// other than RSA of 2048 bits or more, P-256 and P-384, also of the authorities in the chain, an
/// expired certificate or one that is not valid yet.
/// @throws DataError
[[nodiscard]] TlsIdentity UsableTlsIdentity(const std::string& certificate_pem,
                                            const std::string& key_pem,
                                            std::chrono::system_clock::time_point now);

}  // namespace plumb::web
