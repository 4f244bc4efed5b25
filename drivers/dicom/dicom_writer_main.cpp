// SPDX-License-Identifier: Apache-2.0
// plumb-dicom-writer REQUEST: writes a DICOM file to the standard output, as export_wire.hpp says.
//
// A separate process like the reader, so that no other program has DCMTK: 768 MB, 10 s, and no
// right to open, reach or start anything once the request is in memory.
#include <cstring>
#include <exception>
#include <new>
#include <string>
#include <vector>

#include "algo/base/errors.hpp"
#include "drivers/dicom/export_objects.hpp"
#include "drivers/dicom/export_wire.hpp"
#include "drivers/dicom/lock_down.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/reader_program.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

constexpr ReaderLimits kWriterLimits{.memory_bytes = std::uint64_t{768} << 20, .cpu_s = 10};

DicomExport RequestOf(const std::vector<std::uint8_t>& bytes) {
  ExportHeader header;
  if (bytes.size() < sizeof header) throw DataError(say::dicom::ReaderVersion());
  std::memcpy(&header, bytes.data(), sizeof header);
  const std::size_t left = bytes.size() - sizeof header;
  if (header.magic != ExportHeader::kMagic || header.text_bytes > left ||
      header.payload_bytes != left - header.text_bytes)
    throw DataError(say::dicom::ReaderVersion());
  const auto text = bytes.begin() + sizeof header;
  const auto payload = text + static_cast<std::ptrdiff_t>(header.text_bytes);
  DicomExport object = ParseExportFacts(std::string(text, payload));
  object.payload.assign(payload, bytes.end());
  return object;
}

int FailToWrite(const std::exception& error) {
  const std::string text = ReaderErrorText(error);
  WriteToParent(ExportHeader{.is_error = 1, .text_bytes = text.size()});
  WriteToParent(text.data(), text.size());
  return 3;
}

int WriteObject(const std::string& request) try {
  PrepareDicomWriting();
  const std::vector<std::uint8_t> bytes =
      ReadWholeFile(request, sizeof(ExportHeader) + kMostExportFacts + kMostExportBytes);
  LockDown();
  const std::vector<std::uint8_t> file = EncodeDicom(RequestOf(bytes));
  WriteToParent(ExportHeader{.payload_bytes = file.size()});
  WriteToParent(file.data(), file.size());
  return 0;
} catch (const std::bad_alloc&) {
  return FailToWrite(DataError(say::dicom::TooMuchMemory()));
} catch (const std::exception& error) {
  return FailToWrite(error);
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  plumb::RunReaderProgram([&] { return plumb::WriteObject(argv[1]); }, plumb::kWriterLimits);
}
