// Prints the catalogue of effects for the reference that the daemon serves.
#include <iostream>

#include "dynamics/catalogue.h"

int main() {
  std::cout << joulecast::dynamics::catalogue_markdown() << std::flush;
  return std::cout.good() ? 0 : 1;
}
