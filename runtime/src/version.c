// keeps the library non-empty until the composer lands
extern int lxrt_version_number;
int lxrt_version_number = 1;
