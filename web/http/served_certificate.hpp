// SPDX-License-Identifier: Apache-2.0
// A certificate and its key in the form that GnuTLS needs at each handshake.
#pragma once

#include <array>

#include <gnutls/abstract.h>

#include "web/security/tls_identity.hpp"

namespace plumb::web {

/// GnuTLS only borrows it: it must outlive every handshake that uses it.
class ServedCertificate {
 public:
  /// @throws DataError if GnuTLS cannot serve it.
  explicit ServedCertificate(const TlsIdentity& identity);
  ~ServedCertificate();
  ServedCertificate(const ServedCertificate&) = delete;
  ServedCertificate& operator=(const ServedCertificate&) = delete;

  [[nodiscard]] gnutls_pcert_st* chain() { return chain_.data(); }
  [[nodiscard]] unsigned length() const { return length_; }
  [[nodiscard]] gnutls_privkey_t key() const { return key_; }

 private:
  void Release();

  std::array<gnutls_pcert_st, 8> chain_{};
  unsigned length_ = 0;
  gnutls_privkey_t key_ = nullptr;
};

}  // namespace plumb::web
