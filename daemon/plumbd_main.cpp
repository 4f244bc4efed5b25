// SPDX-License-Identifier: Apache-2.0
#include "daemon/config/version.hpp"
#include "daemon/loop/crash_report.hpp"
#include "daemon/loop/freed_memory.hpp"
#include "daemon/plumbd/plumbd.hpp"

int main(int argc, char** argv) {
  plumb::KeepFreedMemory();
  plumb::ReportCrashes("plumbd", plumb::Version().data());
  return plumb::RunPlumbd(argc, argv);
}
