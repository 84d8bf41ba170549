#include "abbe/cli/cli.hpp"

int main(int argc, char** argv) {
  return abbe::daemon::run_cli(argc, argv);
}
