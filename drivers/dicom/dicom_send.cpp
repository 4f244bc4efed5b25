// SPDX-License-Identifier: Apache-2.0
#include "drivers/dicom/dicom_send.hpp"

#include <string>

#include "algo/base/errors.hpp"
#include "drivers/dicom/dicom_program.hpp"
#include "drivers/dicom/export_wire.hpp"
#include "drivers/files/reader_process.hpp"
#include "words/dicom.hpp"

namespace plumb {

void SendDicom(const DicomSendRequest& request, const std::function<void(std::size_t)>& on_sent) {
  DicomProgram sender("plumb-dicom-sender", {SendRequestText(request)});
  for (std::size_t sent = 0; sent < request.files.size();) {
    ExportHeader header;
    sender.Read(&header, sizeof header);
    if (header.magic != ExportHeader::kMagic || header.text_bytes > kMostExportFacts)
      throw DataError(say::dicom::ReaderVersion());
    std::string text(static_cast<std::size_t>(header.text_bytes), ' ');
    sender.Read(text.data(), text.size());
    if (header.is_error != 0) throw DataError(ReaderErrorOf(text));
    // Without a stored file it only says that it is at work.
    if (header.payload_bytes > 0) on_sent(++sent);
  }
}

}  // namespace plumb
