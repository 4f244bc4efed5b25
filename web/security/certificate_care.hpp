// Warnings about the page's certificate before browsers reject it.
#pragma once

#include <chrono>
#include <ctime>
#include <string>
#include <vector>

#include "web/security/tls_identity.hpp"

namespace plumb::web {

/// Time before its end from which a certificate is warned about.
inline constexpr std::chrono::hours kWarnBeforeEnd{30 * 24};

/// Sentences for people, each with the subject of its certificate: a weak key (RSA of less than
/// 2048 bits, curves of less than 224), an expiry that has passed or comes within kWarnBeforeEnd, a
/// validity that has not begun. Checks the first certificate's key and every date of the chain.
/// Empty if there is nothing to report.
/// @param pem  The certificate and any that lead from it to an authority; other blocks are ignored.
/// @throws DataError if it contains no certificate that can be read.
[[nodiscard]] std::vector<std::string> CertificateWarnings(
    const std::string& pem, std::chrono::system_clock::time_point now);

/// Properties of a certificate for comparison and planning.
struct CertificateFacts {
  std::string subject;
  std::time_t valid_until = 0;  ///< Expiry of the certificate of its chain that expires first.
};
/// @throws DataError as CertificateWarnings().
[[nodiscard]] CertificateFacts FactsOfCertificate(const std::string& pem);

/// CheckedTlsIdentity() for an uploaded identity: also refuses what browsers would reject now, such
/// as a weak key, an expired certificate or one that is not valid yet.
/// @throws DataError
[[nodiscard]] TlsIdentity UsableTlsIdentity(const std::string& certificate_pem,
                                            const std::string& key_pem,
                                            std::chrono::system_clock::time_point now);

}  // namespace plumb::web
