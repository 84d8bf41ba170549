// Random machines with typical faults of a shop floor, standstill mode. Prints the same table as
// never_worse_otf.
#include "campaign.hpp"
#include "otf_run.hpp"

int main(int argc, char** argv) {
  using namespace abbe::tests::never_worse;
  return run_campaign<OtfRun>(
      {"standstill", standstill_faults(), random_standstill_run, identify_and_compare}, argc, argv);
}
