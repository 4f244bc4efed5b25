#include "web/security/certificate_care.hpp"

#include <algorithm>
#include <array>
#include <ctime>
#include <memory>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <gnutls/gnutls.h>
#include <gnutls/x509.h>

#include "algo/base/errors.hpp"

namespace plumb::web {
namespace {

using Certificate = std::unique_ptr<gnutls_x509_crt_int, decltype(&gnutls_x509_crt_deinit)>;

std::vector<Certificate> ChainOf(const std::string& pem) {
  std::array<gnutls_x509_crt_t, kMaxChain> chain{};
  unsigned count = kMaxChain;
  const gnutls_datum_t text{
      const_cast<unsigned char*>(reinterpret_cast<const unsigned char*>(pem.data())),
      static_cast<unsigned>(pem.size())};
  const int result = gnutls_x509_crt_list_import(chain.data(), &count, &text, GNUTLS_X509_FMT_PEM,
                                                 GNUTLS_X509_CRT_LIST_IMPORT_FAIL_IF_EXCEED);
  if (result < 0)
    throw DataError(fmt::format("the page's certificate cannot be read: {}; expected PEM",
                                gnutls_strerror(result)));
  std::vector<Certificate> held;
  for (unsigned i = 0; i < count; ++i) held.emplace_back(chain[i], &gnutls_x509_crt_deinit);
  return held;
}

/// The subject in the certificate, without control characters, because the text comes from outside.
std::string SubjectOf(const Certificate& certificate) {
  std::array<char, 512> text{};
  std::size_t size = text.size();
  if (gnutls_x509_crt_get_dn(certificate.get(), text.data(), &size) < 0 || size == 0)
    return "(without a name)";
  std::string subject(text.data());
  for (char& c : subject) {
    if (c < 0x20 || c == 0x7F) c = '?';  // also anything that is not ASCII
  }
  return subject;
}

std::string Day(std::time_t time) {
  return fmt::format("{:%Y-%m-%d %H:%M} UTC", fmt::gmtime(time));
}

bool HasWeakKey(const Certificate& certificate, unsigned& bits) {
  const int algorithm = gnutls_x509_crt_get_pk_algorithm(certificate.get(), &bits);
  return algorithm < 0 || gnutls_pk_bits_to_sec_param(static_cast<gnutls_pk_algorithm_t>(algorithm),
                                                      bits) < GNUTLS_SEC_PARAM_MEDIUM;
}

void WarnOfDates(const Certificate& certificate, std::time_t now,
                 std::vector<std::string>& warnings) {
  const std::time_t begin = gnutls_x509_crt_get_activation_time(certificate.get());
  const std::time_t end = gnutls_x509_crt_get_expiration_time(certificate.get());
  const std::string subject = SubjectOf(certificate);
  if (now < begin) {
    warnings.push_back(fmt::format(
        "the page's certificate {} is valid only from {}: browsers refuse it; check the clock",
        subject, Day(begin)));
  }
  if (now >= end) {
    warnings.push_back(fmt::format(
        "the page's certificate {} ended on {}: browsers refuse it; put a new one in its place",
        subject, Day(end)));
  } else if (end - now <= std::chrono::seconds(kWarnBeforeEnd).count()) {
    warnings.push_back(fmt::format(
        "the page's certificate {} ends on {}: browsers refuse it from then on; put a new one in "
        "its place before",
        subject, Day(end)));
  }
}

}  // namespace

std::vector<std::string> CertificateWarnings(const std::string& pem,
                                             std::chrono::system_clock::time_point now) {
  std::vector<std::string> warnings;
  const std::vector<Certificate> chain = ChainOf(pem);
  unsigned bits = 0;
  if (HasWeakKey(chain.front(), bits)) {
    warnings.push_back(fmt::format(
        "the key of the page's certificate {} is too weak ({} bits): browsers refuse it; make one "
        "of 256 bits on an elliptic curve, or of 2048 with RSA",
        SubjectOf(chain.front()), bits));
  }
  for (const Certificate& certificate : chain)
    WarnOfDates(certificate, std::chrono::system_clock::to_time_t(now), warnings);
  return warnings;
}

CertificateFacts FactsOfCertificate(const std::string& pem) {
  const std::vector<Certificate> chain = ChainOf(pem);
  CertificateFacts facts{.subject = SubjectOf(chain.front()),
                         .valid_until = gnutls_x509_crt_get_expiration_time(chain.front().get())};
  for (const Certificate& certificate : chain)
    facts.valid_until =
        std::min(facts.valid_until, gnutls_x509_crt_get_expiration_time(certificate.get()));
  return facts;
}

TlsIdentity UsableTlsIdentity(const std::string& certificate_pem, const std::string& key_pem,
                              std::chrono::system_clock::time_point now) {
  TlsIdentity identity = CheckedTlsIdentity(certificate_pem, key_pem, "what was handed in");
  const std::vector<Certificate> chain = ChainOf(certificate_pem);
  const auto refuse = [](const Certificate& certificate, const std::string& why) {
    throw DataError(fmt::format("the certificate {} {}", SubjectOf(certificate), why));
  };
  if (unsigned bits = 0; HasWeakKey(chain.front(), bits))
    refuse(chain.front(), fmt::format("has a key of only {} bits: make one of 256 on an elliptic "
                                      "curve, or of 2048 with RSA",
                                      bits));
  const std::time_t time = std::chrono::system_clock::to_time_t(now);
  for (const Certificate& certificate : chain) {
    const std::time_t begin = gnutls_x509_crt_get_activation_time(certificate.get());
    const std::time_t end = gnutls_x509_crt_get_expiration_time(certificate.get());
    if (time >= end) refuse(certificate, fmt::format("ended on {}: upload a newer one", Day(end)));
    if (time < begin)
      refuse(certificate, fmt::format("is valid only from {}: check the clock", Day(begin)));
  }
  return identity;
}

}  // namespace plumb::web
