/* Start-up of an exported self-test on QEMU's mps2-an386, and the system calls that newlib's printf needs, by semihosting. */
#include <stdint.h>
#include <sys/stat.h>

int main(void);
void reset(void);
int _write(int file, const char *text, int length);
int _read(int file, char *text, int length);
int _close(int file);
int _fstat(int file, struct stat *status);
int _isatty(int file);
int _lseek(int file, int offset, int from);
void *_sbrk(int bytes);
void _exit(int status);

extern uint32_t stack_top, data_load, data_start, data_end, bss_start, bss_end;
extern char heap_start;

__attribute__((section(".vectors"), used)) static const void *const vectors[] = {
    &stack_top, (const void *)reset, (const void *)reset, (const void *)reset,
};

static int semihosting(int operation, const void *argument)
{
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static void leave(int passed)
{
    /* SYS_EXIT with ADP_Stopped_ApplicationExit is success; any other reason makes QEMU return 1. */
    semihosting(0x18, (const void *)(passed ? 0x20026 : 0x20023));
    for (;;) {
    }
}

void _exit(int status)
{
    leave(status == 0);
    for (;;) {
    }
}

void reset(void)
{
    const uint32_t *from = &data_load;
    uint32_t *to;
    for (to = &data_start; to < &data_end; to++) {
        *to = *from++;
    }
    for (to = &bss_start; to < &bss_end; to++) {
        *to = 0;
    }
#ifdef __ARM_FP
    /* CPACR: coprocessors 10 and 11, the floating-point unit. */
    *(volatile uint32_t *)0xE000ED88 |= 0xFu << 20;
    __asm__ volatile("dsb\n isb" ::: "memory");
#endif
    leave(main() == 0);
}

int _write(int file, const char *text, int length)
{
    int i;
    (void)file;
    for (i = 0; i < length; i++) {
        semihosting(0x03, &text[i]); /* SYS_WRITEC */
    }
    return length;
}

int _read(int file, char *text, int length) { (void)file, (void)text, (void)length; return 0; }
int _close(int file) { (void)file; return -1; }
int _fstat(int file, struct stat *status) { (void)file; status->st_mode = S_IFCHR; return 0; }
int _isatty(int file) { (void)file; return 1; }
int _lseek(int file, int offset, int from) { (void)file, (void)offset, (void)from; return 0; }

void *_sbrk(int bytes)
{
    static char *end = &heap_start;
    char *const start = end;
    end += bytes;
    return start;
}
