#include "web/security/tls_identity.hpp"

#include <arpa/inet.h>
#include <unistd.h>

#include <array>
#include <ctime>
#include <memory>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gnutls/crypto.h>
#include <gnutls/gnutls.h>
#include <gnutls/x509.h>

#include "algo/base/errors.hpp"

namespace plumb::web {
namespace {

constexpr std::time_t kValidFrom = 1577836800;  // 2020-01-01

void Check(int result, std::string_view what) {
  if (result < 0) throw IoError(fmt::format("{}: {}", what, gnutls_strerror(result)));
}

gnutls_datum_t Datum(const std::string& text) {
  return {const_cast<unsigned char*>(reinterpret_cast<const unsigned char*>(text.data())),
          static_cast<unsigned>(text.size())};
}

using Certificate = std::unique_ptr<gnutls_x509_crt_int, decltype(&gnutls_x509_crt_deinit)>;
using Key = std::unique_ptr<gnutls_x509_privkey_int, decltype(&gnutls_x509_privkey_deinit)>;

Certificate NewCertificate() {
  gnutls_x509_crt_t made = nullptr;
  Check(gnutls_x509_crt_init(&made), "cannot make a certificate");
  return {made, &gnutls_x509_crt_deinit};
}

Key NewKey() {
  gnutls_x509_privkey_t made = nullptr;
  Check(gnutls_x509_privkey_init(&made), "cannot make a key");
  return {made, &gnutls_x509_privkey_deinit};
}

std::string FingerprintOf(const Certificate& certificate) {
  std::array<unsigned char, 32> digest{};
  std::size_t size = digest.size();
  Check(gnutls_x509_crt_get_fingerprint(certificate.get(), GNUTLS_DIG_SHA256, digest.data(), &size),
        "cannot compute the fingerprint of a certificate");
  return fmt::format("{:02X}", fmt::join(digest, ":"));
}

/// Output of a GnuTLS export function that allocates its own buffer.
template <typename Export>
std::string PemOf(Export&& write) {
  gnutls_datum_t pem{};
  Check(write(&pem), "cannot write a certificate or key as PEM");
  std::string text(reinterpret_cast<const char*>(pem.data), pem.size);
  gnutls_free(pem.data);
  return text;
}

void AddName(const Certificate& certificate, const std::string& name) {
  std::array<unsigned char, sizeof(in6_addr)> address{};
  for (const auto& [family, bytes] : {std::pair(AF_INET, 4U), std::pair(AF_INET6, 16U)}) {
    if (inet_pton(family, name.c_str(), address.data()) != 1) continue;
    return Check(gnutls_x509_crt_set_subject_alt_name(certificate.get(), GNUTLS_SAN_IPADDRESS,
                                                      address.data(), bytes, GNUTLS_FSAN_APPEND),
                 "cannot add an address to a certificate");
  }
  Check(
      gnutls_x509_crt_set_subject_alt_name(certificate.get(), GNUTLS_SAN_DNSNAME, name.data(),
                                           static_cast<unsigned>(name.size()), GNUTLS_FSAN_APPEND),
      "cannot add a name to a certificate");
}

void Describe(const Certificate& certificate, const Key& key,
              const std::vector<std::string>& names) {
  constexpr const char* kWhat = "cannot make a certificate";
  std::array<unsigned char, 16> serial{};
  Check(gnutls_rnd(GNUTLS_RND_NONCE, serial.data(), serial.size()), kWhat);
  serial[0] &= 0x7F;  // positive and not zero
  serial[0] |= 0x40;
  Check(gnutls_x509_crt_set_version(certificate.get(), 3), kWhat);
  Check(gnutls_x509_crt_set_serial(certificate.get(), serial.data(), serial.size()), kWhat);
  Check(gnutls_x509_crt_set_activation_time(certificate.get(), kValidFrom), kWhat);
  Check(gnutls_x509_crt_set_expiration_time(
            certificate.get(), static_cast<std::time_t>(GNUTLS_X509_NO_WELL_DEFINED_EXPIRATION)),
        kWhat);
  constexpr std::string_view kSubject = "Plumb scan appliance";
  Check(gnutls_x509_crt_set_dn_by_oid(certificate.get(), GNUTLS_OID_X520_COMMON_NAME, 0,
                                      kSubject.data(), static_cast<unsigned>(kSubject.size())),
        kWhat);
  Check(gnutls_x509_crt_set_key(certificate.get(), key.get()), kWhat);
  Check(gnutls_x509_crt_set_basic_constraints(certificate.get(), 0, -1), kWhat);
  Check(gnutls_x509_crt_set_key_usage(certificate.get(), GNUTLS_KEY_DIGITAL_SIGNATURE), kWhat);
  Check(
      gnutls_x509_crt_set_key_purpose_oid(certificate.get(), GNUTLS_KP_TLS_WWW_SERVER, /*crit=*/0),
      kWhat);
  for (const std::string& name : names) AddName(certificate, name);
}

}  // namespace

TlsIdentity MakeTlsIdentity(const std::vector<std::string>& names) {
  std::vector<std::string> all = {"localhost", "127.0.0.1", "::1"};
  std::array<char, 65> host{};
  if (gethostname(host.data(), host.size() - 1) == 0 && host[0] != '\0') {
    all.emplace_back(host.data());
    all.push_back(all.back() + ".local");
  }
  all.insert(all.end(), names.begin(), names.end());
  const Key key = NewKey();
  Check(gnutls_x509_privkey_generate(key.get(), GNUTLS_PK_ECDSA,
                                     GNUTLS_CURVE_TO_BITS(GNUTLS_ECC_CURVE_SECP256R1), 0),
        "cannot make a key");
  const Certificate certificate = NewCertificate();
  Describe(certificate, key, all);
  Check(
      gnutls_x509_crt_sign2(certificate.get(), certificate.get(), key.get(), GNUTLS_DIG_SHA256, 0),
      "cannot sign a certificate");
  return {.certificate_pem = PemOf([&](gnutls_datum_t* pem) {
            return gnutls_x509_crt_export2(certificate.get(), GNUTLS_X509_FMT_PEM, pem);
          }),
          .key_pem = PemOf([&](gnutls_datum_t* pem) {
            return gnutls_x509_privkey_export2_pkcs8(key.get(), GNUTLS_X509_FMT_PEM, nullptr,
                                                     GNUTLS_PKCS_PLAIN, pem);
          }),
          .fingerprint = FingerprintOf(certificate)};
}

TlsIdentity CheckedTlsIdentity(const std::string& certificate_pem, const std::string& key_pem,
                               const std::string& name) {
  const auto refuse = [&](int result, std::string_view what) {
    if (result < 0)
      throw DataError(fmt::format("{}: {} ({}); expected PEM files as `openssl req` writes them",
                                  name, what, gnutls_strerror(result)));
  };
  std::array<gnutls_x509_crt_t, kMaxChain> chain{};
  unsigned count = kMaxChain;
  const gnutls_datum_t certificate_text = Datum(certificate_pem), key_text = Datum(key_pem);
  refuse(gnutls_x509_crt_list_import(chain.data(), &count, &certificate_text, GNUTLS_X509_FMT_PEM,
                                     GNUTLS_X509_CRT_LIST_IMPORT_FAIL_IF_EXCEED),
         "holds no certificate that can be read");
  std::vector<Certificate> held;
  for (unsigned i = 0; i < count; ++i) held.emplace_back(chain[i], &gnutls_x509_crt_deinit);
  const Key key = NewKey();
  refuse(gnutls_x509_privkey_import2(key.get(), &key_text, GNUTLS_X509_FMT_PEM, nullptr, 0),
         "holds no key that can be read without a password");
  std::array<unsigned char, 64> of_certificate{}, of_key{};
  std::size_t size = of_certificate.size(), key_size = of_key.size();
  refuse(gnutls_x509_crt_get_key_id(held.front().get(), GNUTLS_KEYID_USE_SHA256,
                                    of_certificate.data(), &size),
         "holds a certificate of an unknown kind");
  refuse(
      gnutls_x509_privkey_get_key_id(key.get(), GNUTLS_KEYID_USE_SHA256, of_key.data(), &key_size),
      "holds a key of an unknown kind");
  if (size != key_size || of_certificate != of_key)
    throw DataError(fmt::format(
        "{}: the key is not that of the certificate; give the two that were made together", name));
  return {certificate_pem, key_pem, FingerprintOf(held.front())};
}

}  // namespace plumb::web
