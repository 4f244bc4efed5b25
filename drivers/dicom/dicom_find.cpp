// SPDX-License-Identifier: Apache-2.0
#include "drivers/dicom/dicom_find.hpp"

#include <string>

#include "algo/base/errors.hpp"
#include "drivers/dicom/dicom_program.hpp"
#include "drivers/dicom/export_wire.hpp"
#include "drivers/files/reader_process.hpp"
#include "words/dicom.hpp"

namespace plumb {

std::vector<WorklistStep> FindWorklist(const WorklistRequest& request) {
  // Each step has two short fields, each letter of which JSON may write as six.
  constexpr std::size_t kMostText = kMostWorklistSteps * 1024;
  DicomProgram finder("plumb-dicom-finder", {WorklistRequestText(request)});
  ExportHeader header;
  finder.Read(&header, sizeof header);
  if (header.magic != ExportHeader::kMagic || header.text_bytes > kMostText)
    throw DataError(say::dicom::ReaderVersion());
  std::string text(static_cast<std::size_t>(header.text_bytes), ' ');
  finder.Read(text.data(), text.size());
  if (header.is_error != 0) throw DataError(ReaderErrorOf(text));
  return ParseWorklist(text);
}

}  // namespace plumb
