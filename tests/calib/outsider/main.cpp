#include <abbe/calib/otf/identify/identify.hpp>
#include <iostream>

int main() {
  const auto chain = abbe::calib::KinematicChain::parse("[w X' b Y Z t]");
  const auto x = abbe::calib::equidistant_nodes(-0.3, 0.3);
  const abbe::calib::otf::Machine machine{*chain, {*x, *x, *x}, {0.0, 0.0, -0.1}};
  const auto nothing = abbe::calib::otf::identify({}, machine, {}, {});
  std::cout << nothing.error().text << '\n';
  return nothing ? 1 : 0;
}
