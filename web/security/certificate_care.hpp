// What people are told about the certificate of the page before browsers refuse it.
#pragma once

#include <chrono>
#include <ctime>
#include <string>
#include <vector>

#include "web/security/tls_identity.hpp"

namespace plumb::web {

/// From this long before its end a certificate is warned about.
inline constexpr std::chrono::hours kWarnBeforeEnd{30 * 24};

/// Sentences for people, each with the subject of the certificate that it is about: a key that is
/// too weak (RSA of less than 2048 bits, curves of less than 224), an end that has come or comes
/// within kWarnBeforeEnd, a beginning that has not come. The first certificate's key and every
/// date of the chain are looked at. Empty: nothing to tell.
/// @param pem  The certificate and any that lead from it to an authority; other blocks are ignored.
/// @throws DataError if there is no certificate in it that can be read.
[[nodiscard]] std::vector<std::string> CertificateWarnings(
    const std::string& pem, std::chrono::system_clock::time_point now);

/// What people compare and plan by.
struct CertificateFacts {
  std::string subject;
  std::time_t valid_until = 0;  ///< Of the certificate of its chain that ends first.
};
/// @throws DataError as CertificateWarnings().
[[nodiscard]] CertificateFacts FactsOfCertificate(const std::string& pem);

/// CheckedTlsIdentity() for what a person hands in: also refuses what browsers would refuse now, a
/// weak key, an end that has come, a beginning that has not.
/// @throws DataError
[[nodiscard]] TlsIdentity UsableTlsIdentity(const std::string& certificate_pem,
                                            const std::string& key_pem,
                                            std::chrono::system_clock::time_point now);

}  // namespace plumb::web
