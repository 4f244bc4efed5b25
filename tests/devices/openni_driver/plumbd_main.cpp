// SPDX-License-Identifier: Apache-2.0
// plumbd with the virtual sensor as OpenNI2 shows it, and no other driver.
#include "daemon/plumbd/plumbd.hpp"
#include "tests/devices/openni_driver/virtual_openni_driver.hpp"

int main(int argc, char** argv) {
  plumb::SensorRegistry known;
  plumb::AddVirtualOpenNiDriver(known);
  return plumb::RunPlumbd(argc, argv, known);
}
