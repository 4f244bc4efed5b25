// SPDX-License-Identifier: Apache-2.0
// The files of TLS as the programs of DICOM take them.
#pragma once

#include "daemon/config/dicom_settings.hpp"
#include "drivers/dicom/send_content.hpp"

namespace plumb {

inline DicomTlsFiles TlsFilesOf(const DicomSettings& settings) {
  return {.certificate = settings.tls_certificate.string(),
          .key = settings.tls_key.string(),
          .trusted = settings.tls_trusted.string()};
}

}  // namespace plumb
