// Random machines with typical faults of a shop floor, ball array method. Prints the same table as
// never_worse_otf.
#include "campaign.hpp"
#include "evemu_run.hpp"

int main(int argc, char** argv) {
  using namespace abbe::tests::never_worse;
  return run_campaign<EvemuRun>(
      {"ball array", evemu_faults(), random_evemu_run, identify_and_compare_evemu}, argc, argv);
}
