#include "daemon/appliance/plumbd.hpp"

int main(int argc, char** argv) { return plumb::RunPlumbd(argc, argv); }
