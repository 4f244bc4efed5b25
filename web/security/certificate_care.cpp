// SPDX-License-Identifier: Apache-2.0
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
#include "words/web.hpp"

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
  if (result < 0) throw DataError(say::web::CertificateUnreadable(gnutls_strerror(result)));
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

/// The kind of a key that browsers do not accept, in words; empty if they accept it. The number of
/// bits is not checked here.
std::string UnopenedKind(const Certificate& certificate) {
  unsigned bits = 0;
  const int algorithm = gnutls_x509_crt_get_pk_algorithm(certificate.get(), &bits);
  if (algorithm == GNUTLS_PK_RSA) return {};
  if (algorithm == GNUTLS_PK_ECDSA) {
    gnutls_ecc_curve_t curve = GNUTLS_ECC_CURVE_INVALID;
    if (gnutls_x509_crt_get_pk_ecc_raw(certificate.get(), &curve, nullptr, nullptr) < 0)
      return "ECDSA";
    if (curve == GNUTLS_ECC_CURVE_SECP256R1 || curve == GNUTLS_ECC_CURVE_SECP384R1) return {};
    return gnutls_ecc_curve_get_name(curve);
  }
  const char* name = gnutls_pk_algorithm_get_name(static_cast<gnutls_pk_algorithm_t>(algorithm));
  return name != nullptr ? name : "?";
}

bool HasWeakKey(const Certificate& certificate, unsigned& bits) {
  const int algorithm = gnutls_x509_crt_get_pk_algorithm(certificate.get(), &bits);
  return algorithm < 0 || gnutls_pk_bits_to_sec_param(static_cast<gnutls_pk_algorithm_t>(algorithm),
                                                      bits) < GNUTLS_SEC_PARAM_MEDIUM;
}

void WarnOfDates(const Certificate& certificate, std::time_t now, std::vector<Message>& warnings) {
  const std::time_t begin = gnutls_x509_crt_get_activation_time(certificate.get());
  const std::time_t end = gnutls_x509_crt_get_expiration_time(certificate.get());
  const std::string subject = SubjectOf(certificate);
  if (now < begin) warnings.push_back(say::web::CertificateNotYet(subject, Day(begin)));
  if (now >= end) {
    warnings.push_back(say::web::CertificateEnded(subject, Day(end)));
  } else if (end - now <= std::chrono::seconds(kWarnBeforeEnd).count()) {
    warnings.push_back(say::web::CertificateEnds(subject, Day(end)));
  }
}

}  // namespace

std::vector<Message> CertificateWarnings(const std::string& pem,
                                         std::chrono::system_clock::time_point now) {
  std::vector<Message> warnings;
  const std::vector<Certificate> chain = ChainOf(pem);
  for (const Certificate& certificate : chain) {
    unsigned bits = 0;
    if (HasWeakKey(certificate, bits)) {
      warnings.push_back(say::web::CertificateWeak(SubjectOf(certificate), bits));
    } else if (const std::string kind = UnopenedKind(certificate); !kind.empty())
      warnings.push_back(say::web::CertificateKind(SubjectOf(certificate), kind));
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

bool IsDueForRenewal(const std::string& pem,
                     std::optional<std::chrono::system_clock::time_point> now,
                     const std::vector<std::string>& names) {
  const std::vector<Certificate> chain = ChainOf(pem);
  const gnutls_x509_crt_t own = chain.front().get();
  const bool is_self_signed = chain.size() == 1 && gnutls_x509_crt_check_issuer(own, own) != 0 &&
                              SubjectOf(chain.front()) == fmt::format("CN={}", kOwnSubject);
  if (!is_self_signed && !OwnAuthorityOf(pem)) return false;
  const std::chrono::seconds most = is_self_signed ? kOwnValidity : kIssuedValidity;
  const std::time_t begin = gnutls_x509_crt_get_activation_time(own),
                    end = gnutls_x509_crt_get_expiration_time(own);
  if (now) {
    const std::time_t time = std::chrono::system_clock::to_time_t(*now);
    if (time < begin || end - time <= std::chrono::seconds(2 * kWarnBeforeEnd).count() ||
        end - begin > most.count())
      return true;
  }
  return std::any_of(names.begin(), names.end(), [&](const std::string& name) {
    return gnutls_x509_crt_check_hostname(own, name.c_str()) == 0;
  });
}

TlsIdentity UsableTlsIdentity(const std::string& certificate_pem, const std::string& key_pem,
                              std::chrono::system_clock::time_point now) {
  TlsIdentity identity = CheckedTlsIdentity(certificate_pem, key_pem, say::web::HandedIn());
  const std::vector<Certificate> chain = ChainOf(certificate_pem);
  for (const Certificate& certificate : chain) {
    if (const std::string kind = UnopenedKind(certificate); !kind.empty())
      throw DataError(say::web::GivenCertificateKind(SubjectOf(certificate), kind));
    if (unsigned bits = 0; HasWeakKey(certificate, bits))
      throw DataError(say::web::GivenCertificateWeak(SubjectOf(certificate), bits));
  }
  const std::time_t time = std::chrono::system_clock::to_time_t(now);
  for (const Certificate& certificate : chain) {
    const std::time_t begin = gnutls_x509_crt_get_activation_time(certificate.get());
    const std::time_t end = gnutls_x509_crt_get_expiration_time(certificate.get());
    if (time >= end)
      throw DataError(say::web::GivenCertificateEnded(SubjectOf(certificate), Day(end)));
    if (time < begin)
      throw DataError(say::web::GivenCertificateNotYet(SubjectOf(certificate), Day(begin)));
  }
  return identity;
}

}  // namespace plumb::web
