// SPDX-License-Identifier: Apache-2.0
// Linked into every program that is built with the address sanitizer: libraries stay loaded to the
// end.
//
// OpenNI2 unloads its drivers when it is shut down, before leaks are counted. What a driver has not
// freed could then not be distinguished from what another one has not: ours, the virtual sensor's,
// must free everything, those of OpenNI2 are listed in lsan.supp.
extern "C" __attribute__((visibility("default"))) int dlclose(void* /*library*/) noexcept {
  return 0;
}
