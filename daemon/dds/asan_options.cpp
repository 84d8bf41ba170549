// Fast DDS 2.9.1 deletes its StatisticsWriterImpl's data through a base type of another size
// whenever a writer goes: not ours to repair, and nothing but the size is wrong. Linked into
// programs with Fast DDS when ASan is on.
extern "C" const char* __asan_default_options();
extern "C" const char* __asan_default_options() {
  return "new_delete_type_mismatch=0";
}
