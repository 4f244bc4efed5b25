// SPDX-License-Identifier: Apache-2.0
#include "drivers/dicom/dicom_network.hpp"

#include <dcmtk/config/osconfig.h>

#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmnet/dcmtrans.h>
#include <dcmtk/dcmnet/dul.h>
#include <dcmtk/dcmtls/tlslayer.h>
#include <dcmtk/oflog/oflog.h>

#include "algo/base/errors.hpp"
#include "words/dicom.hpp"

namespace plumb {

void PrepareDicomNetwork() {
  OFLog::configure(OFLogger::OFF_LOG_LEVEL);
  if (!dcmDataDict.isDictionaryLoaded()) throw IoError(say::dicom::NoDictionary());
  dcmDisableGethostbyaddr.set(OFTrue);
  dcmConnectionTimeout.set(kConnectPatience_s);
  dcmSocketSendTimeout.set(kAnswerPatience_s);
  dcmSocketReceiveTimeout.set(kAnswerPatience_s);
}

std::unique_ptr<DcmTransportLayer> MakeDicomTls(const DicomTlsFiles& files, DicomRole role) {
  DcmTLSTransportLayer::initializeOpenSSL();
  auto layer = std::make_unique<DcmTLSTransportLayer>(
      role == DicomRole::kSends ? NET_REQUESTOR : NET_ACCEPTOR, nullptr, OFFalse);
  const auto check = [](const OFCondition& condition, const std::string& file) {
    if (condition.bad()) throw DataError(say::dicom::TlsFile(file, condition.text()));
  };
  layer->setPrivateKeyPasswd("");  // or it would be asked for
  check(layer->setPrivateKeyFile(files.key.c_str(), DCF_Filetype_PEM), files.key);
  check(layer->setCertificateFile(files.certificate.c_str(), DCF_Filetype_PEM), files.certificate);
  if (!layer->checkPrivateKeyMatchesCertificate())
    throw DataError(say::dicom::TlsPair(files.key, files.certificate));
  check(layer->addTrustedCertificateFile(files.trusted.c_str(), DCF_Filetype_PEM), files.trusted);
  check(layer->setTLSProfile(TSP_Profile_BCP195_ND), files.certificate);
  check(layer->activateCipherSuites(), files.certificate);
  layer->setCertificateVerification(DCV_requireCertificate);
  return layer;
}

}  // namespace plumb
