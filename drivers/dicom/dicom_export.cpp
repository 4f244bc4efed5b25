// SPDX-License-Identifier: Apache-2.0
#include "drivers/dicom/dicom_export.hpp"

#include <algorithm>
#include <array>
#include <span>

#include "algo/base/errors.hpp"
#include "drivers/dicom/dicom_program.hpp"
#include "drivers/dicom/export_wire.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/reader_process.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

/// A file that lives as long as this object.
class PassingFile {
 public:
  explicit PassingFile(fs::path path) : path_(std::move(path)) {}
  ~PassingFile() {
    std::error_code error;
    fs::remove(path_, error);
  }
  PassingFile(const PassingFile&) = delete;
  PassingFile& operator=(const PassingFile&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

void WriteRequest(const DicomExport& object, const fs::path& file) {
  const std::string facts = ExportFactsOf(object);
  if (facts.size() > kMostExportFacts || object.payload.size() > kMostExportBytes)
    throw DataError(say::dicom::TooLarge(static_cast<std::int64_t>(kMostExportBytes >> 20)));
  const ExportHeader header{.text_bytes = facts.size(), .payload_bytes = object.payload.size()};
  FileWriter writer(file);
  writer.Write({reinterpret_cast<const char*>(&header), sizeof header});
  writer.Write(facts);
  writer.Write(std::span<const std::uint8_t>(object.payload));
  writer.Close();
}

}  // namespace

void WriteDicomExport(const DicomExport& object, const fs::path& file) {
  const PassingFile request(fs::path(file) += ".request");
  WriteRequest(object, request.path());
  DicomProgram program("plumb-dicom-writer", {fs::absolute(request.path()).string()});
  ExportHeader header;
  program.Read(&header, sizeof header);
  if (header.magic != ExportHeader::kMagic || header.text_bytes > kMostExportFacts ||
      header.payload_bytes > kMostExportBytes + kMostExportFacts)
    throw DataError(say::dicom::ReaderVersion());
  std::string text(static_cast<std::size_t>(header.text_bytes), ' ');
  program.Read(text.data(), text.size());
  if (header.is_error != 0) throw DataError(ReaderErrorOf(text));
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(header.payload_bytes));
  program.Read(bytes.data(), bytes.size());
  WriteWholeFile(file, std::span<const std::uint8_t>(bytes));
}

std::string UidOfDigest(std::string_view sha256_hex) {
  // The first 128 bits as a decimal number, by long division.
  std::array<unsigned, 32> digits{};
  for (std::size_t i = 0; i < digits.size(); ++i) {
    const char c = sha256_hex.at(i);
    digits[i] = static_cast<unsigned>(c <= '9' ? c - '0' : c - 'a' + 10);
  }
  std::string decimal;
  while (std::ranges::any_of(digits, [](unsigned digit) { return digit != 0; })) {
    unsigned rest = 0;
    for (unsigned& digit : digits) {
      const unsigned value = rest * 16 + digit;
      digit = value / 10;
      rest = value % 10;
    }
    decimal.insert(decimal.begin(), static_cast<char>('0' + rest));
  }
  return "2.25." + (decimal.empty() ? "0" : decimal);
}

}  // namespace plumb
