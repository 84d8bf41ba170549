// Random machines with every fault of a shop floor, ball array method. Prints what never_worse_otf
// prints.
#include "campaign.hpp"
#include "evemu_run.hpp"

int main(int argc, char** argv) {
  using namespace abbe::tests::never_worse;
  return run_campaign<EvemuRun>(
      {"ball array", evemu_faults(), random_evemu_run, identify_and_compare_evemu}, argc, argv);
}
