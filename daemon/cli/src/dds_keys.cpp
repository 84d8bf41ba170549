/// `abbe dds keys`: makes keys and permissions for DDS Security, so that only participants with
/// such keys can publish and read in the DDS domain.

#include <fmt/format.h>

#include <chrono>
#include <memory>
#include <string>

#include "abbe/messages/dds_security.hpp"
#include "dds_keys.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

struct KeyArguments {
  std::string folder;
  int subscribers = 1;
  int days = 3650;
};

void print_next_steps(const KeyArguments& arguments) {
  const std::string folder =
      std::filesystem::absolute(arguments.folder).lexically_normal().string();
  fmt::print(
      "made {}: a certificate authority, and identities for the daemon and {} subscriber{}, valid "
      "for {} days\n",
      folder, arguments.subscribers, arguments.subscribers == 1 ? "" : "s", arguments.days);
  fmt::print(
      "next:\n"
      "  1. chown -R abbe-dds: {0}/daemon      # the user abbe-dds runs as\n"
      "  2. in abbed.toml, under [dds]:  security = \"{0}/daemon\"     then restart abbed\n"
      "  3. copy {0}/subscriber-1 to the first subscriber's computer; there:\n"
      "       abbe watch --security subscriber-1\n"
      "  4. move {0}/ca.key to a safe place away from this computer: with this file anyone can "
      "make identities\n"
      "Then only participants with such an identity can publish or read; see `abbe status`.\n",
      folder);
}

int make_keys(const KeyArguments& arguments) {
  const auto made = make_dds_keys({.folder = arguments.folder,
                                   .subscribers = arguments.subscribers,
                                   .validity = std::chrono::days{arguments.days}},
                                  std::chrono::system_clock::now());
  if (!made) return report(made.error());
  print_next_steps(arguments);
  return 0;
}

}  // namespace

void add_dds_keys(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<KeyArguments>();
  auto* command = parent.add_subcommand("keys",
                                        "Make keys and permissions for DDS Security: only "
                                        "participants with such an identity can publish or read");
  command
      ->add_option("-o,--out", arguments->folder,
                   "new folder for the keys; existing files are not overwritten")
      ->required();
  command
      ->add_option("--subscribers", arguments->subscribers,
                   "number of subscribers; each gets its own identity")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000));
  command->add_option("--days", arguments->days, "validity of the identities, days")
      ->capture_default_str()
      ->check(CLI::Range(1, 36500));
  command->callback([arguments, &exit] { exit = make_keys(*arguments); });
}

}  // namespace abbe::daemon
