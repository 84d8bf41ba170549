/// `abbe identify artefact`: makes the calibrator file of a ball array from touches in one position
/// on an accurate machine.

#include <fmt/format.h>

#include <memory>

#include "abbe/base/units.hpp"
#include "abbe/tasks/identify_artefact.hpp"
#include "commands.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

int run(const IdentifyArtefactArguments& arguments) {
  const auto found = identify_artefact(arguments);
  if (!found) return report(found.error());
  const auto& calibrator = found->calibrator;
  for (const auto& ball : calibrator.balls)
    fmt::print("ball {:<2} radius {:.4f} mm, u = {:.2f} um\n", ball.number, kMmPerM * ball.radius_m,
               kUmPerM * ball.u_m);
  for (const auto& block : calibrator.blocks)
    fmt::print("block {} u = {:.1f} urad\n", block.number, kUmPerM * block.u_rad);
  fmt::print("written {}\n", arguments.out);

  return 0;
}

}  // namespace

void add_identify_artefact(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<IdentifyArtefactArguments>();
  auto* command = parent.add_subcommand(
      "artefact",
      "Make the calibrator file of a ball array from touches in one position on an accurate "
      "machine");
  command
      ->add_option("--touches", arguments->touches,
                   "touches.csv: position,kind,index,x_mm,y_mm,z_mm")
      ->required();
  command->add_option("--name", arguments->name, "name of the artefact")->required();
  command->add_option("--tip-radius-mm", arguments->tip_radius_mm, "tip radius of these touches")
      ->check(CLI::NonNegativeNumber)
      ->required();
  command
      ->add_option("--machine-tip-radius-mm", arguments->machine_tip_radius_mm,
                   "tip radius on the machine to be calibrated; default: that of --tip-radius-mm")
      ->check(CLI::NonNegativeNumber);
  command
      ->add_option(
          "--u-touch-um", arguments->u_touch_um,
          "standard uncertainty of a touch, needed for balls with 4 touches and blocks with 3; "
          "from more touches it is estimated")
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--outward-1", arguments->outward_1,
                   "x,y,z: approximate outward normal of the face of block 1")
      ->capture_default_str();
  command->add_option("--outward-2", arguments->outward_2, "the same for block 2")
      ->capture_default_str();
  command->add_option("-o,--out", arguments->out, "file to write: calibrator.toml")->required();
  command->callback([arguments, &exit] { exit = run(*arguments); });
}

}  // namespace abbe::daemon
