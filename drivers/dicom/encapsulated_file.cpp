// SPDX-License-Identifier: Apache-2.0
#include "drivers/dicom/encapsulated_file.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

constexpr std::size_t kPreamble = 128;
constexpr std::uint32_t kTransferSyntax = 0x00020010, kClassOfFile = 0x00020002,
                        kDocument = 0x00420011, kDocumentLength = 0x00420015;
constexpr std::string_view kRawDataClass = "1.2.840.10008.5.1.4.1.1.66";
constexpr std::string_view kExplicit = "1.2.840.10008.1.2.1", kImplicit = "1.2.840.10008.1.2";

struct Element {
  std::uint32_t tag = 0;
  std::span<const std::uint8_t> value;
};

/// The elements of the outermost level, one after the other.
class ElementReader {
 public:
  explicit ElementReader(std::span<const std::uint8_t> bytes) : rest_(bytes) {}

  [[nodiscard]] bool IsAtEnd() const { return rest_.empty(); }
  [[nodiscard]] bool IsInHeader() const {
    return rest_.size() >= 2 && rest_[0] == 2 && rest_[1] == 0;
  }
  Element Next(bool is_explicit) {
    Element element{.tag = static_cast<std::uint32_t>(Number(2)) << 16, .value = {}};
    element.tag |= static_cast<std::uint32_t>(Number(2));
    std::size_t length = 0;
    if (is_explicit) {
      const std::span<const std::uint8_t> kind = Take(2);
      const std::string name(kind.begin(), kind.end());
      constexpr std::array<std::string_view, 12> kLong = {"OB", "OD", "OF", "OL", "OV", "OW",
                                                          "SQ", "SV", "UC", "UN", "UR", "UT"};
      const bool is_long = name == "UV" || std::ranges::find(kLong, name) != kLong.end();
      if (is_long) (void)Take(2);
      length = Number(is_long ? 4 : 2);
    } else {
      length = Number(4);
    }
    element.value = Take(length);  // an undefined length is longer than any file
    return element;
  }

 private:
  std::span<const std::uint8_t> Take(std::size_t count) {
    if (count > rest_.size()) throw DataError(say::dicom::NoPatientExport());
    const std::span<const std::uint8_t> taken = rest_.first(count);
    rest_ = rest_.subspan(count);
    return taken;
  }
  std::size_t Number(std::size_t num_bytes) {
    std::size_t number = 0, shift = 0;
    for (const std::uint8_t byte : Take(num_bytes)) {
      number |= static_cast<std::size_t>(byte) << shift;
      shift += 8;
    }
    return number;
  }

  std::span<const std::uint8_t> rest_;
};

/// A UID, which is padded by a zero byte to an even length.
std::string UidIn(std::span<const std::uint8_t> value) {
  std::string uid(value.begin(), value.end());
  while (!uid.empty() && (uid.back() == '\0' || uid.back() == ' ')) uid.pop_back();
  return uid;
}

}  // namespace

std::vector<std::uint8_t> EncapsulatedDocument(const std::filesystem::path& file,
                                               std::size_t most) {
  const std::vector<std::uint8_t> bytes = ReadWholeFile(file, most);
  constexpr std::string_view kMagic = "DICM";
  if (bytes.size() < kPreamble + kMagic.size() ||
      !std::equal(kMagic.begin(), kMagic.end(), bytes.begin() + kPreamble))
    throw DataError(say::dicom::NoPatientExport());
  ElementReader reader{std::span<const std::uint8_t>(bytes).subspan(kPreamble + kMagic.size())};
  std::string syntax, kind;
  while (reader.IsInHeader()) {
    const Element element = reader.Next(/*is_explicit=*/true);
    if (element.tag == kTransferSyntax) syntax = UidIn(element.value);
    if (element.tag == kClassOfFile) kind = UidIn(element.value);
  }
  if (kind != kRawDataClass || (syntax != kExplicit && syntax != kImplicit))
    throw DataError(say::dicom::NoPatientExport());
  std::span<const std::uint8_t> document;
  std::size_t length = 0;
  while (!reader.IsAtEnd()) {
    const Element element = reader.Next(syntax == kExplicit);
    if (element.tag == kDocument) document = element.value;
    if (element.tag != kDocumentLength || element.value.size() != sizeof(std::uint32_t)) continue;
    for (std::size_t i = 0; i < element.value.size(); ++i)
      length |= static_cast<std::size_t>(element.value[i]) << (8 * i);
  }
  if (length == 0 || length > document.size()) throw DataError(say::dicom::NoPatientExport());
  return {document.begin(), document.begin() + static_cast<std::ptrdiff_t>(length)};
}

}  // namespace plumb
