// SPDX-License-Identifier: Apache-2.0
#include "drivers/dicom/dicom_program.hpp"

#include <filesystem>
#include <optional>
#include <utility>

#include "algo/base/errors.hpp"
#include "drivers/program_folders.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

std::filesystem::path InstalledProgram(const std::string& name) {
  const std::optional<std::filesystem::path> program = FindBesideProgram("lib/plumb/" + name);
  if (!program) throw IoError(say::dicom::ProgramMissing(name));
  return *program;
}

}  // namespace

DicomProgram::DicomProgram(const std::string& name, std::vector<std::string> arguments)
    : process_(InstalledProgram(name), std::move(arguments)) {}

void DicomProgram::Read(void* data, std::size_t size) {
  switch (process_.Read(data, size)) {
    case ReaderProcess::Got::kAll:
      return;
    case ReaderProcess::Got::kEnd: {
      const ReaderProcess::End end = process_.Reap();
      throw DataError(end.crashed ? say::dicom::ReaderCrashed(end.code)
                                  : say::dicom::ReaderEnded(end.code));
    }
    case ReaderProcess::Got::kSilence:
      throw DataError(say::dicom::ReaderSilent());
  }
}

}  // namespace plumb
