// SPDX-License-Identifier: Apache-2.0
#include "web/http/served_certificate.hpp"

#include "algo/base/errors.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

gnutls_datum_t Datum(const std::string& text) {
  return {const_cast<unsigned char*>(reinterpret_cast<const unsigned char*>(text.data())),
          static_cast<unsigned>(text.size())};
}

}  // namespace

ServedCertificate::ServedCertificate(const TlsIdentity& identity) {
  const gnutls_datum_t certificate = Datum(identity.certificate_pem);
  const gnutls_datum_t key = Datum(identity.key_pem);
  unsigned count = chain_.size();
  int result = gnutls_pcert_list_import_x509_raw(chain_.data(), &count, &certificate,
                                                 GNUTLS_X509_FMT_PEM, GNUTLS_X509_CRT_LIST_SORT);
  if (result >= 0) {
    length_ = count;
    result = gnutls_privkey_init(&key_);
  }
  if (result >= 0)
    result = gnutls_privkey_import_x509_raw(key_, &key, GNUTLS_X509_FMT_PEM, nullptr, 0);
  if (result >= 0) return;
  Release();
  throw DataError(say::web::CertificateNotServed(identity.fingerprint, gnutls_strerror(result)));
}

ServedCertificate::~ServedCertificate() { Release(); }

void ServedCertificate::Release() {
  for (unsigned i = 0; i < length_; ++i) gnutls_pcert_deinit(&chain_.at(i));
  if (key_ != nullptr) gnutls_privkey_deinit(key_);
}

}  // namespace plumb::web
