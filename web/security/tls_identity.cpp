// SPDX-License-Identifier: Apache-2.0
#include "web/security/tls_identity.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>
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
#include "words/web.hpp"

namespace plumb::web {
namespace {

using Failed = Message (*)(std::string_view why);

void Check(int result, Failed failed) {
  if (result < 0) throw IoError(failed(gnutls_strerror(result)));
}

gnutls_datum_t Datum(const std::string& text) {
  return {const_cast<unsigned char*>(reinterpret_cast<const unsigned char*>(text.data())),
          static_cast<unsigned>(text.size())};
}

using Certificate = std::unique_ptr<gnutls_x509_crt_int, decltype(&gnutls_x509_crt_deinit)>;
using Key = std::unique_ptr<gnutls_x509_privkey_int, decltype(&gnutls_x509_privkey_deinit)>;

Certificate NewCertificate() {
  gnutls_x509_crt_t made = nullptr;
  Check(gnutls_x509_crt_init(&made), say::web::CannotMakeCertificate);
  return {made, &gnutls_x509_crt_deinit};
}

Key NewKey() {
  gnutls_x509_privkey_t made = nullptr;
  Check(gnutls_x509_privkey_init(&made), say::web::CannotMakeKey);
  return {made, &gnutls_x509_privkey_deinit};
}

std::string FingerprintOf(const Certificate& certificate) {
  std::array<unsigned char, 32> digest{};
  std::size_t size = digest.size();
  Check(gnutls_x509_crt_get_fingerprint(certificate.get(), GNUTLS_DIG_SHA256, digest.data(), &size),
        say::web::CannotFingerprint);
  return fmt::format("{:02X}", fmt::join(digest, ":"));
}

/// Output of a GnuTLS export function that allocates its own buffer.
template <typename Export>
std::string PemOf(Export&& write) {
  gnutls_datum_t pem{};
  Check(write(&pem), say::web::CannotWritePem);
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
                 say::web::CannotAddAddress);
  }
  Check(
      gnutls_x509_crt_set_subject_alt_name(certificate.get(), GNUTLS_SAN_DNSNAME, name.data(),
                                           static_cast<unsigned>(name.size()), GNUTLS_FSAN_APPEND),
      say::web::CannotAddName);
}

using Clock = std::chrono::system_clock;

/// What every certificate has: a serial number, its dates, its subject and its key.
void Begin(const Certificate& certificate, const Key& key, const std::string& subject,
           Clock::time_point now, std::chrono::hours validity) {
  // The browser's clock may be behind, or in another time zone.
  const Clock::time_point begin = now - std::chrono::hours(24);
  constexpr Failed kWhat = say::web::CannotMakeCertificate;
  std::array<unsigned char, 16> serial{};
  Check(gnutls_rnd(GNUTLS_RND_NONCE, serial.data(), serial.size()), kWhat);
  serial[0] &= 0x7F;  // positive and not zero
  serial[0] |= 0x40;
  Check(gnutls_x509_crt_set_version(certificate.get(), 3), kWhat);
  Check(gnutls_x509_crt_set_serial(certificate.get(), serial.data(), serial.size()), kWhat);
  Check(gnutls_x509_crt_set_activation_time(certificate.get(), Clock::to_time_t(begin)), kWhat);
  Check(gnutls_x509_crt_set_expiration_time(certificate.get(), Clock::to_time_t(begin + validity)),
        kWhat);
  Check(gnutls_x509_crt_set_dn_by_oid(certificate.get(), GNUTLS_OID_X520_COMMON_NAME, 0,
                                      subject.data(), static_cast<unsigned>(subject.size())),
        kWhat);
  Check(gnutls_x509_crt_set_key(certificate.get(), key.get()), kWhat);
  std::array<unsigned char, 20> id{};
  std::size_t size = id.size();
  Check(gnutls_x509_crt_get_key_id(certificate.get(), 0, id.data(), &size), kWhat);
  Check(gnutls_x509_crt_set_subject_key_id(certificate.get(), id.data(), size), kWhat);
}

Key GeneratedKey() {
  Key key = NewKey();
  Check(gnutls_x509_privkey_generate(key.get(), GNUTLS_PK_ECDSA,
                                     GNUTLS_CURVE_TO_BITS(GNUTLS_ECC_CURVE_SECP256R1), 0),
        say::web::CannotMakeKey);
  return key;
}

void Describe(const Certificate& certificate, const std::vector<std::string>& names) {
  constexpr Failed kWhat = say::web::CannotMakeCertificate;
  Check(gnutls_x509_crt_set_basic_constraints(certificate.get(), 0, -1), kWhat);
  Check(gnutls_x509_crt_set_key_usage(certificate.get(), GNUTLS_KEY_DIGITAL_SIGNATURE), kWhat);
  Check(
      gnutls_x509_crt_set_key_purpose_oid(certificate.get(), GNUTLS_KP_TLS_WWW_SERVER, /*crit=*/0),
      kWhat);
  for (const std::string& name : names) AddName(certificate, name);
}

std::string PemOfCertificate(const Certificate& certificate) {
  return PemOf([&](gnutls_datum_t* pem) {
    return gnutls_x509_crt_export2(certificate.get(), GNUTLS_X509_FMT_PEM, pem);
  });
}

std::string PemOfKey(const Key& key) {
  return PemOf([&](gnutls_datum_t* pem) {
    return gnutls_x509_privkey_export2_pkcs8(key.get(), GNUTLS_X509_FMT_PEM, nullptr,
                                             GNUTLS_PKCS_PLAIN, pem);
  });
}

bool IsAddress(const std::string& name) {
  std::array<unsigned char, sizeof(in6_addr)> address{};
  return inet_pton(AF_INET, name.c_str(), address.data()) == 1 ||
         inet_pton(AF_INET6, name.c_str(), address.data()) == 1;
}

using Constraints =
    std::unique_ptr<gnutls_name_constraints_st, decltype(&gnutls_x509_name_constraints_deinit)>;

Constraints NewConstraints() {
  gnutls_x509_name_constraints_t made = nullptr;
  Check(gnutls_x509_name_constraints_init(&made), say::web::CannotMakeCertificate);
  return {made, &gnutls_x509_name_constraints_deinit};
}

/// @throws DataError
Certificate AuthorityIn(const std::string& authority) {
  Certificate certificate = NewCertificate();
  const gnutls_datum_t text = Datum(authority);
  if (const int result = gnutls_x509_crt_import(certificate.get(), &text, GNUTLS_X509_FMT_PEM);
      result < 0)
    throw DataError(say::web::CertificateUnreadable(gnutls_strerror(result)));
  return certificate;
}

}  // namespace

std::vector<std::string> OwnAddresses() {
  std::vector<std::string> addresses;
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return addresses;
  for (const ifaddrs* one = list; one != nullptr; one = one->ifa_next) {
    if (one->ifa_addr == nullptr || (one->ifa_flags & IFF_LOOPBACK) != 0) continue;
    std::array<char, INET6_ADDRSTRLEN> text{};
    if (one->ifa_addr->sa_family == AF_INET) {
      inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(one->ifa_addr)->sin_addr,
                text.data(), text.size());
    } else if (one->ifa_addr->sa_family == AF_INET6) {
      const in6_addr& v6 = reinterpret_cast<const sockaddr_in6*>(one->ifa_addr)->sin6_addr;
      if (IN6_IS_ADDR_LINKLOCAL(&v6)) continue;
      inet_ntop(AF_INET6, &v6, text.data(), text.size());
    } else {
      continue;
    }
    addresses.emplace_back(text.data());
  }
  freeifaddrs(list);
  return addresses;
}

std::vector<std::string> OwnNames() {
  std::array<char, 65> host{};
  if (gethostname(host.data(), host.size() - 1) != 0 || host[0] == '\0') return {};
  return {host.data(), std::string(host.data()) + ".local"};
}

namespace {

/// What a browser on this machine or in its networks may call it.
std::vector<std::string> AllNames(const std::vector<std::string>& names) {
  std::vector<std::string> all = {"localhost", "127.0.0.1", "::1"};
  for (const std::vector<std::string>& more : {OwnNames(), OwnAddresses(), names})
    all.insert(all.end(), more.begin(), more.end());
  return all;
}

}  // namespace

TlsIdentity MakeTlsIdentity(const std::vector<std::string>& names, Clock::time_point now) {
  const Key key = GeneratedKey();
  const Certificate certificate = NewCertificate();
  Begin(certificate, key, std::string(kOwnSubject), now, kOwnValidity);
  Describe(certificate, AllNames(names));
  Check(
      gnutls_x509_crt_sign2(certificate.get(), certificate.get(), key.get(), GNUTLS_DIG_SHA256, 0),
      say::web::CannotSignCertificate);
  return {.certificate_pem = PemOfCertificate(certificate),
          .key_pem = PemOfKey(key),
          .fingerprint = FingerprintOf(certificate)};
}

std::string MakeAuthority(const std::vector<std::string>& names, Clock::time_point now) {
  constexpr Failed kWhat = say::web::CannotMakeCertificate;
  constexpr std::chrono::hours kValidity{20 * 365 * 24};
  const Key key = GeneratedKey();
  const Certificate certificate = NewCertificate();
  std::array<unsigned char, 4> mark{};
  Check(gnutls_rnd(GNUTLS_RND_NONCE, mark.data(), mark.size()), kWhat);
  Begin(certificate, key, fmt::format("{}{:02X}", kAuthoritySubject, fmt::join(mark, "")), now,
        kValidity);
  Check(gnutls_x509_crt_set_basic_constraints(certificate.get(), 1, /*pathLenConstraint=*/0),
        kWhat);
  Check(gnutls_x509_crt_set_key_usage(certificate.get(), GNUTLS_KEY_KEY_CERT_SIGN), kWhat);
  const Constraints allowed = NewConstraints();
  for (const std::string& name : AllNames(names)) {
    if (IsAddress(name)) continue;
    const gnutls_datum_t text = Datum(name);
    Check(gnutls_x509_name_constraints_add_permitted(allowed.get(), GNUTLS_SAN_DNSNAME, &text),
          kWhat);
  }
  Check(gnutls_x509_crt_set_name_constraints(certificate.get(), allowed.get(), /*critical=*/1),
        kWhat);
  Check(
      gnutls_x509_crt_sign2(certificate.get(), certificate.get(), key.get(), GNUTLS_DIG_SHA256, 0),
      say::web::CannotSignCertificate);
  return PemOfCertificate(certificate) + PemOfKey(key);
}

bool CanIssue(const std::string& authority, const std::vector<std::string>& names,
              Clock::time_point now) {
  const Certificate certificate = AuthorityIn(authority);
  if (Clock::to_time_t(now) < gnutls_x509_crt_get_activation_time(certificate.get()) ||
      Clock::to_time_t(now + kIssuedValidity) >
          gnutls_x509_crt_get_expiration_time(certificate.get()))
    return false;
  const Constraints allowed = NewConstraints();
  unsigned critical = 0;
  if (gnutls_x509_crt_get_name_constraints(certificate.get(), allowed.get(), 0, &critical) < 0)
    return false;  // not one of ours
  for (const std::string& name : AllNames(names)) {
    const gnutls_datum_t text = Datum(name);
    if (!IsAddress(name) &&
        gnutls_x509_name_constraints_check(allowed.get(), GNUTLS_SAN_DNSNAME, &text) == 0)
      return false;
  }
  return true;
}

TlsIdentity IssueTlsIdentity(const std::string& authority, const std::vector<std::string>& names,
                             Clock::time_point now) {
  const Certificate issuer = AuthorityIn(authority);
  const Key issuer_key = NewKey();
  const gnutls_datum_t text = Datum(authority);
  if (const int result =
          gnutls_x509_privkey_import2(issuer_key.get(), &text, GNUTLS_X509_FMT_PEM, nullptr, 0);
      result < 0)
    throw DataError(say::web::CertificateUnreadable(gnutls_strerror(result)));
  const Key key = GeneratedKey();
  const Certificate certificate = NewCertificate();
  Begin(certificate, key, std::string(kOwnSubject), now, kIssuedValidity);
  Describe(certificate, AllNames(names));
  std::array<unsigned char, 64> id{};
  std::size_t size = id.size();
  Check(gnutls_x509_crt_get_subject_key_id(issuer.get(), id.data(), &size, nullptr),
        say::web::CannotSignCertificate);
  Check(gnutls_x509_crt_set_authority_key_id(certificate.get(), id.data(), size),
        say::web::CannotSignCertificate);
  Check(gnutls_x509_crt_sign2(certificate.get(), issuer.get(), issuer_key.get(), GNUTLS_DIG_SHA256,
                              0),
        say::web::CannotSignCertificate);
  return {.certificate_pem = PemOfCertificate(certificate) + PemOfCertificate(issuer),
          .key_pem = PemOfKey(key),
          .fingerprint = FingerprintOf(certificate)};
}

std::optional<AuthorityCertificate> OwnAuthorityOf(const std::string& chain_pem) {
  std::array<gnutls_x509_crt_t, kMaxChain> chain{};
  unsigned count = kMaxChain;
  const gnutls_datum_t text = Datum(chain_pem);
  if (gnutls_x509_crt_list_import(chain.data(), &count, &text, GNUTLS_X509_FMT_PEM,
                                  GNUTLS_X509_CRT_LIST_IMPORT_FAIL_IF_EXCEED) < 0)
    return std::nullopt;
  std::vector<Certificate> held;
  for (unsigned i = 0; i < count; ++i) held.emplace_back(chain[i], &gnutls_x509_crt_deinit);
  const auto name_of = [](const Certificate& certificate) {
    std::array<char, 128> name{};
    std::size_t size = name.size();
    return gnutls_x509_crt_get_dn_by_oid(certificate.get(), GNUTLS_OID_X520_COMMON_NAME, 0, 0,
                                         name.data(), &size) < 0
               ? std::string()
               : std::string(name.data());
  };
  if (count != 2 || name_of(held[0]) != kOwnSubject ||
      !name_of(held[1]).starts_with(kAuthoritySubject) ||
      gnutls_x509_crt_check_issuer(held[0].get(), held[1].get()) == 0)
    return std::nullopt;
  return AuthorityCertificate{PemOfCertificate(held[1]), FingerprintOf(held[1])};
}

TlsIdentity CheckedTlsIdentity(const std::string& certificate_pem, const std::string& key_pem,
                               const Message& what) {
  const auto refuse = [&](int result, Message (*why)(Message, std::string_view)) {
    if (result < 0) throw DataError(why(what, gnutls_strerror(result)));
  };
  std::array<gnutls_x509_crt_t, kMaxChain> chain{};
  unsigned count = kMaxChain;
  const gnutls_datum_t certificate_text = Datum(certificate_pem), key_text = Datum(key_pem);
  refuse(gnutls_x509_crt_list_import(chain.data(), &count, &certificate_text, GNUTLS_X509_FMT_PEM,
                                     GNUTLS_X509_CRT_LIST_IMPORT_FAIL_IF_EXCEED),
         say::web::HoldsNoCertificate);
  std::vector<Certificate> held;
  for (unsigned i = 0; i < count; ++i) held.emplace_back(chain[i], &gnutls_x509_crt_deinit);
  const Key key = NewKey();
  refuse(gnutls_x509_privkey_import2(key.get(), &key_text, GNUTLS_X509_FMT_PEM, nullptr, 0),
         say::web::HoldsNoKey);
  std::array<unsigned char, 64> of_certificate{}, of_key{};
  std::size_t size = of_certificate.size(), key_size = of_key.size();
  refuse(gnutls_x509_crt_get_key_id(held.front().get(), GNUTLS_KEYID_USE_SHA256,
                                    of_certificate.data(), &size),
         say::web::HoldsUnknownCertificate);
  refuse(
      gnutls_x509_privkey_get_key_id(key.get(), GNUTLS_KEYID_USE_SHA256, of_key.data(), &key_size),
      say::web::HoldsUnknownKey);
  if (size != key_size || of_certificate != of_key) throw DataError(say::web::OtherKey(what));
  return {certificate_pem, key_pem, FingerprintOf(held.front())};
}

}  // namespace plumb::web
